"""Whether results can be used: a set of them reviewed together, and trials of the diagnosis.

Read read_together (which files), grounds (what each says for and against), loops (margins of model and
simulation beside each other), review (the door), sealed_trial.
"""
