"""The diagnosis tried on the user's own simulation and flights, with effects inserted whose truth is known.

Here: insertions, their draws and what is answered to them. Not here: any rule of the diagnosis itself; these
are called where they stand in `infer`. Read `insertions`, `answers`, `smallest`, then `self_test`.
"""
