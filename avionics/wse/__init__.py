"""Wing-shape estimation: the mathematics of RG-WSE and CRG-WSE, without clocks or files.

Sources, cited by these short names: "Srikanth et al." is Srikanth, Afonso, Lustosa, "Experimental
Aided Inertial Estimation of Wing Shape for Flexible Aircraft Control"; "Lustosa et al." is
"Aided Inertial Estimation of Wing Shape", JGCD 44(2), 2021.
"""
