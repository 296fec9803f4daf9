"""Training of dynamics models, and tracking with them."""
