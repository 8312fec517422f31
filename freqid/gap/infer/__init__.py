"""Questions to the one model: is there a gap, which effect, where, which pair, how sure.

Read `system` (small matrices), `evidence`, then the questions.
"""
