"""From a simulation and flights to a diagnosis of the gap between them."""
