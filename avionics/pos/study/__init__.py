"""Studies of distributed POS: specifications, runs, tables, figures and pages."""
