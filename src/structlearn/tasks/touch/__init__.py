"""Tasks with touch: latent space, contact place and force of a skin, tactile servoing, slides."""
