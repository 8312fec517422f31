"""What results are held against, and what follows: truth of a simulation, sealed effects, reviews."""
