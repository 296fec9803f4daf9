"""Where obstacles stand, and the simulated people who reach past them."""
