"""The reproduction of the dissertation: simulated testbeds, public recordings and the evidence of both."""
