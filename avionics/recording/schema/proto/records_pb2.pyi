from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class ImuSample(_message.Message):
    __slots__ = ("t_ns", "pod", "seq", "rate_rad_s", "specific_force_m_s2", "magnetic_flux_t")
    T_NS_FIELD_NUMBER: _ClassVar[int]
    POD_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    RATE_RAD_S_FIELD_NUMBER: _ClassVar[int]
    SPECIFIC_FORCE_M_S2_FIELD_NUMBER: _ClassVar[int]
    MAGNETIC_FLUX_T_FIELD_NUMBER: _ClassVar[int]
    t_ns: int
    pod: str
    seq: int
    rate_rad_s: _containers.RepeatedScalarFieldContainer[float]
    specific_force_m_s2: _containers.RepeatedScalarFieldContainer[float]
    magnetic_flux_t: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, t_ns: _Optional[int] = ..., pod: _Optional[str] = ..., seq: _Optional[int] = ..., rate_rad_s: _Optional[_Iterable[float]] = ..., specific_force_m_s2: _Optional[_Iterable[float]] = ..., magnetic_flux_t: _Optional[_Iterable[float]] = ...) -> None: ...

class MarkerTracks(_message.Message):
    __slots__ = ("t_ns", "camera", "frame_index", "pixel", "sigma_px", "found", "tracker")
    T_NS_FIELD_NUMBER: _ClassVar[int]
    CAMERA_FIELD_NUMBER: _ClassVar[int]
    FRAME_INDEX_FIELD_NUMBER: _ClassVar[int]
    PIXEL_FIELD_NUMBER: _ClassVar[int]
    SIGMA_PX_FIELD_NUMBER: _ClassVar[int]
    FOUND_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    t_ns: int
    camera: str
    frame_index: int
    pixel: _containers.RepeatedScalarFieldContainer[float]
    sigma_px: _containers.RepeatedScalarFieldContainer[float]
    found: _containers.RepeatedScalarFieldContainer[bool]
    tracker: str
    def __init__(self, t_ns: _Optional[int] = ..., camera: _Optional[str] = ..., frame_index: _Optional[int] = ..., pixel: _Optional[_Iterable[float]] = ..., sigma_px: _Optional[_Iterable[float]] = ..., found: _Optional[_Iterable[bool]] = ..., tracker: _Optional[str] = ...) -> None: ...

class WingShapeEstimate(_message.Message):
    __slots__ = ("t_ns", "wing", "kind", "basis", "phi_rad", "theta_rad", "psi_rad", "phi_sigma_rad", "theta_sigma_rad", "psi_sigma_rad", "bias_rad_s", "bias_sigma_rad_s", "line_in_body_m", "tip_sigma_m", "marker_px", "marker_sigma_px", "nis", "used", "covariance")
    T_NS_FIELD_NUMBER: _ClassVar[int]
    WING_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    BASIS_FIELD_NUMBER: _ClassVar[int]
    PHI_RAD_FIELD_NUMBER: _ClassVar[int]
    THETA_RAD_FIELD_NUMBER: _ClassVar[int]
    PSI_RAD_FIELD_NUMBER: _ClassVar[int]
    PHI_SIGMA_RAD_FIELD_NUMBER: _ClassVar[int]
    THETA_SIGMA_RAD_FIELD_NUMBER: _ClassVar[int]
    PSI_SIGMA_RAD_FIELD_NUMBER: _ClassVar[int]
    BIAS_RAD_S_FIELD_NUMBER: _ClassVar[int]
    BIAS_SIGMA_RAD_S_FIELD_NUMBER: _ClassVar[int]
    LINE_IN_BODY_M_FIELD_NUMBER: _ClassVar[int]
    TIP_SIGMA_M_FIELD_NUMBER: _ClassVar[int]
    MARKER_PX_FIELD_NUMBER: _ClassVar[int]
    MARKER_SIGMA_PX_FIELD_NUMBER: _ClassVar[int]
    NIS_FIELD_NUMBER: _ClassVar[int]
    USED_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    t_ns: int
    wing: str
    kind: str
    basis: str
    phi_rad: _containers.RepeatedScalarFieldContainer[float]
    theta_rad: _containers.RepeatedScalarFieldContainer[float]
    psi_rad: _containers.RepeatedScalarFieldContainer[float]
    phi_sigma_rad: _containers.RepeatedScalarFieldContainer[float]
    theta_sigma_rad: _containers.RepeatedScalarFieldContainer[float]
    psi_sigma_rad: _containers.RepeatedScalarFieldContainer[float]
    bias_rad_s: _containers.RepeatedScalarFieldContainer[float]
    bias_sigma_rad_s: _containers.RepeatedScalarFieldContainer[float]
    line_in_body_m: _containers.RepeatedScalarFieldContainer[float]
    tip_sigma_m: _containers.RepeatedScalarFieldContainer[float]
    marker_px: _containers.RepeatedScalarFieldContainer[float]
    marker_sigma_px: _containers.RepeatedScalarFieldContainer[float]
    nis: float
    used: _containers.RepeatedScalarFieldContainer[bool]
    covariance: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, t_ns: _Optional[int] = ..., wing: _Optional[str] = ..., kind: _Optional[str] = ..., basis: _Optional[str] = ..., phi_rad: _Optional[_Iterable[float]] = ..., theta_rad: _Optional[_Iterable[float]] = ..., psi_rad: _Optional[_Iterable[float]] = ..., phi_sigma_rad: _Optional[_Iterable[float]] = ..., theta_sigma_rad: _Optional[_Iterable[float]] = ..., psi_sigma_rad: _Optional[_Iterable[float]] = ..., bias_rad_s: _Optional[_Iterable[float]] = ..., bias_sigma_rad_s: _Optional[_Iterable[float]] = ..., line_in_body_m: _Optional[_Iterable[float]] = ..., tip_sigma_m: _Optional[_Iterable[float]] = ..., marker_px: _Optional[_Iterable[float]] = ..., marker_sigma_px: _Optional[_Iterable[float]] = ..., nis: _Optional[float] = ..., used: _Optional[_Iterable[bool]] = ..., covariance: _Optional[_Iterable[float]] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("t_ns", "wing", "source", "marker_in_body_m", "line_in_body_m", "phi_rad", "theta_rad", "psi_rad")
    T_NS_FIELD_NUMBER: _ClassVar[int]
    WING_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    MARKER_IN_BODY_M_FIELD_NUMBER: _ClassVar[int]
    LINE_IN_BODY_M_FIELD_NUMBER: _ClassVar[int]
    PHI_RAD_FIELD_NUMBER: _ClassVar[int]
    THETA_RAD_FIELD_NUMBER: _ClassVar[int]
    PSI_RAD_FIELD_NUMBER: _ClassVar[int]
    t_ns: int
    wing: str
    source: str
    marker_in_body_m: _containers.RepeatedScalarFieldContainer[float]
    line_in_body_m: _containers.RepeatedScalarFieldContainer[float]
    phi_rad: _containers.RepeatedScalarFieldContainer[float]
    theta_rad: _containers.RepeatedScalarFieldContainer[float]
    psi_rad: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, t_ns: _Optional[int] = ..., wing: _Optional[str] = ..., source: _Optional[str] = ..., marker_in_body_m: _Optional[_Iterable[float]] = ..., line_in_body_m: _Optional[_Iterable[float]] = ..., phi_rad: _Optional[_Iterable[float]] = ..., theta_rad: _Optional[_Iterable[float]] = ..., psi_rad: _Optional[_Iterable[float]] = ...) -> None: ...

class Health(_message.Message):
    __slots__ = ("t_ns", "source", "counters")
    class CountersEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    T_NS_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    COUNTERS_FIELD_NUMBER: _ClassVar[int]
    t_ns: int
    source: str
    counters: _containers.ScalarMap[str, int]
    def __init__(self, t_ns: _Optional[int] = ..., source: _Optional[str] = ..., counters: _Optional[_Mapping[str, int]] = ...) -> None: ...
