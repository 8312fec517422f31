"""The numbers of a diagnosis: each one an error rate, a physical tolerance or a numerical accuracy."""

from __future__ import annotations

LEVEL = 0.02
"""Share of flights without a gap in which one may be called."""

INTERVAL = 0.90
"""Level of the intervals of sizes and shares, and of the set of effects."""

NAMED = 0.75
"""Probability from which a single effect is given as the answer."""

SEPARATE = 4.0
"""Nats (natural logarithm of odds) by which a second effect has to raise the evidence to be called a pair."""

ALIKE = 0.9
"""Cosine beside noise and tolerances from which a parameter of the simulation does what an effect does."""

FORM_ERRORS = (0.0, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
"""Sizes of the error of form that are tried where all terms have one: share of a load, or of a movement."""

FORM_CONSTANT = 4.0
"""Constant error of each term of a load over what varies with frequency.

Chosen, not measured: above one, because derivatives are wrong sooner than dynamics.
"""

FORM_TYPICAL = 0.002
"""Error of form of a good simulation, before the data; no record makes one of a load smaller.

Tolerances take most of what a formula is wrong by, and what they leave looks smaller than it is. It enters
several loads in the ratios of that formula, as an effect does and no error of form: ducts that were wrong by
2 % of what they move were called a slipstream of 2 %.
"""

FORM_KIND_SPREAD = 1.0
"""E-foldings by which the errors of form of all loads, actuators or sensors together may differ from that."""

FORM_SPREAD = 0.7
"""E-foldings by which the error of form of a term differs from its row's, and a row's from its kind's.

Chosen on open cases, as the two before it. Nulls do not depend on it from .7 to 1.5.
"""

FORM_ALIKE = 1.0
"""Errors of form that are the same in all conditions, over those of each condition, where there are any."""

VARIATIONS = (0.0, 0.0125, 0.025, 0.05, 0.1, 0.2, 0.4)
"""Shares of its sigma by which a parameter of the simulation varies for each standard deviation of a motion.

The likeliest of a record is taken. A load that goes with dynamic pressure changes by a tenth as the speed of
a flight does: a formula that has a tenth of that wrong, and a sigma of three per cent, are a share of .3.
"""

SEEN = 0.1
"""Standard deviations of the noise: directions of an error of form or of parameters below it are left out."""

ACTUATOR_FORM = 0.005
"""Least error of form of an actuator, as share of its movement.

A command that is held from sample to sample and one that runs straight differ by 0.26 % at 2 Hz and 50
samples a second, beside a delay, and no log says which of the two it was. A servo that another program
integrates differs by as much again: with 0.002 the lag of a late elevator was taken for its damping.
"""

ACTUATOR_FORM_ERRORS = (0.0, 0.003, 0.02)
"""Sizes of the actuators' error of form where two simulations are compared: share of their movement."""

FORM_ORDER = 4
"""Highest Chebyshev polynomial in frequency of an error of form."""

MOST_LINES = 400
"""Lines of one manoeuvre; more are thinned evenly."""

PAIRS_OF_DRAWS = 48
"""Antithetic pairs of the sensors' noise that are sent through the whole pipeline."""

NULL_DRAWS = 500
"""Draws of the model without effect, in column space."""

TEMPERATURE = 1.0
"""By which log Bayes factors are divided before they become probabilities; fitted on tuning cases."""

FOLDS = 5
"""Parts into which conditions are divided where they take turns in being scored."""

ROUNDS = 2
"""Times that tolerances are made straight about where they came out."""

NOISE_SCALES = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0)
"""Ratios of the loads' flown noise to what the record shows of it, among which the likeliest is taken."""

MOST_ROUNDS = 4
"""Times at most that effects are computed, or lines drawn, again where they came out; two or three do."""

SETTLED = 1.0
"""Nats by which another round makes the data likelier, below which it was the last one."""

FARTHEST = 3.0
"""Sigmas: the largest departure that a simulation flies with, and that tolerances alone may have."""
