"""What every page shares: drawing, notation, sentences and templates; no page and no result.

Read rendering, drawing, notation, findings, figures, pictures, effectors.
"""
