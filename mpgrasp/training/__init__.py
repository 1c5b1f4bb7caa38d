"""Training of networks, and the data that they are trained on."""
