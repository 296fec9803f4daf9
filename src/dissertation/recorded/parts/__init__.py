"""Parts of the torque of a simulated arm that writes characters."""
