"""Ready forms of models, one a file: the equations of motion with applied loads linear in regressors.

Here belong equations that many aircraft share; what belongs to one aircraft is the user's own function. Read
form, then any of them.
"""
