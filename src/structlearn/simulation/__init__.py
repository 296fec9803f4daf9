"""What two testbeds or more simulate: an arm, fingers and their electrodes, noise of a hand."""
