"""Touch on a skin with electrodes: samples, contact points, geodesics, latent space and its dynamics."""
