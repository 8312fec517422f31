"""The whole chain of a scenario: inputs, flights, point models, one global model, and the page of it all."""
