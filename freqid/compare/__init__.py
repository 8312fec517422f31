"""Two simulations side by side, and what a gap costs: stability margins, modes and trim before and after.

Nothing here looks for the cause of a gap (`freqid.gap`) or draws a page (`freqid.report`). Read `linear_loop`
(vehicle, actuators and control law as one linear loop, and its margins), `modes`, `consequence` (figures of
one flight condition, and of two compared), `scenario_consequence` (effects put into a scenario's simulation),
`diagnosis_consequence` (the consequence of what a diagnosis found); `shared_stack` (two simulations on the
same rows, motion and noise), `two_simulations` (which is nearer to the flights) and `comparison_text`.
"""
