from .alignment import Alignment as Alignment, least_squares as least_squares
from .crossings import Crossing as Crossing, find_crossings as find_crossings
from .dtw import correspondences as correspondences
from .parameters import SegmentParameters as SegmentParameters
from .segments import (
    Segmentation as Segmentation,
    cut as cut,
    read_segmentation as read_segmentation,
    write_segmentation as write_segmentation,
)
