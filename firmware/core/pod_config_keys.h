/* Keys of a configuration request, and the settings of the chip that some of them change.
 * Shared by pod_config.c and pod_config_chip.c.
 */
#ifndef POD_CONFIG_KEYS_H
#define POD_CONFIG_KEYS_H

#include "../gen/pod_dbc.h"
#include "bno055.h"

enum {
    KEY_RATE_HZ = 1,
    KEY_RANGE_DPS = 2,
    KEY_BANDWIDTH_HZ = 3,
    KEY_STREAMS = 4,
    KEY_MODE = 5,
    KEY_SAMPLING = 6,
    KEY_NODE = 7,
    KEY_RESET = 8,
    KEY_IDENTIFY = 9,
    KEY_CRYSTAL = 10
};
_Static_assert(KEY_RATE_HZ == POD_DBC_CONFIG_REQUEST_KEY_RATE_HZ_CHOICE, "as in pod.dbc");
_Static_assert(KEY_IDENTIFY == POD_DBC_CONFIG_REQUEST_KEY_IDENTIFY_CHOICE, "as in pod.dbc");
_Static_assert(KEY_CRYSTAL == POD_DBC_CONFIG_REQUEST_KEY_EXTERNAL_CRYSTAL_CHOICE, "as in pod.dbc");

/* Puts the value into the settings; false if the chip has no such setting. */
bool pod_config_change(bno055_settings_t *settings, uint8_t key, uint32_t value);
bool pod_config_is_equal(const bno055_settings_t *a, const bno055_settings_t *b);

#endif
