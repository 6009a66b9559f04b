"""Pictures of a board from cameras with more than 8 bits."""

import numpy as np

from boards import BOARD, picture, poses, true_camera
from manytouch.calibration.camera.board import find_board
from manytouch.calibration.camera.board_views import grey


def test_a_board_is_found_in_the_picture_of_a_12_bit_camera() -> None:
    image = picture(true_camera(), BOARD, next(iter(poses(1))), seed=0)
    deep = np.rint(image * (4095 / 255)).astype(np.uint16)
    np.testing.assert_array_equal(grey(deep), image)
    assert find_board(grey(deep), BOARD) is not None
