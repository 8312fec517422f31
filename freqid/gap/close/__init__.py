"""How far a gap shrinks on manoeuvres that were not used, once an effect and tolerances are fitted."""
