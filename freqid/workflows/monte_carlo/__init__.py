"""Monte Carlo over conditions, seeds, effects and tolerances; one flight through many trims is ``campaign``.

`run` is the door; `plan` says what is asked, `stages` what is done once a case, `rows` how results are kept.
"""
