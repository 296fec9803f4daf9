"""Geodesic distances between contact points on the skin (II.3.3)."""

from structlearn.core.stage import run, stage_parameters
from structlearn.tactile.geodesics import geodesics, write_geodesics
from structlearn.tactile.latent_parameters import GeodesicParameters
from structlearn.tactile.touch_dataset import read_dataset


def main() -> None:
    parameters = stage_parameters("geodesics", GeodesicParameters)
    points = read_dataset("data/servoing/touch.safetensors").contact_point
    write_geodesics(geodesics(points, parameters), "data/servoing/geodesics.safetensors")


if __name__ == "__main__":
    run(main)
