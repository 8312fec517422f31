"""From point models to one global model along the transition corridor."""
