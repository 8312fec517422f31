"""What a design will do to a modelled aircraft and what it will buy; the signals are made in multisine.

Read modelled, closed_loop, experiment, standard_errors, limits, excursions, optimal.
"""
