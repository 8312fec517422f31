"""Models over advance ratio from many manoeuvres: global laws, semi-local refit, all manoeuvres at once.

Read problem (what a manoeuvre is to them), parametric (global), held (semi-local), one_shot, held_out (the
comparison), advance_ratio_study (what a study found); output_error makes a problem of a manoeuvre's motion.
"""
