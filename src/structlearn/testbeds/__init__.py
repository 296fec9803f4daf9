"""The simulated testbeds; none imports another."""
