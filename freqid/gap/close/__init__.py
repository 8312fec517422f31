"""How far a gap shrinks on what was left out, once an effect and tolerances are fitted."""
