"""Models over advance ratio from many manoeuvres: global laws, semi-local refit, all manoeuvres at once.

Read problem (what a manoeuvre is to them), parametric (global), held (semi-local), one_shot, held_out (the
comparison). How one manoeuvre is fitted is not known here.
"""
