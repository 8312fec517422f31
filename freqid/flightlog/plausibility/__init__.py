"""Whether a log can be what it claims: limits, frozen and latched channels, units, signs, swapped columns.

Each check looks at a flight record as it was read and reports findings with their evidence and the setting to
change. Nothing is repaired here, and no aerodynamic model is fitted. Read finding, ranges, repeats, relations
(what kinematics and commands imply of a channel), mistakes (which one explains a contradiction), check.
"""
