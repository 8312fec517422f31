"""How simulations of every kind are connected: one adapter a file."""
