#!/bin/sh
# OpenCV 5.0.0 (opencv-python-headless 5.0.0.93) has the AprilTag families, and pupil-apriltags 1.0.4.post11 is the AprilTag library itself: both know the same tag by its number, but not by its top.
# A tag that OpenCV draws (`generateImageMarker`) stands upside down for AprilTag: its pose is turned by half a turn about the normal.
# Expected: an upright tag, straight ahead of the camera, has the identity for its rotation in AprilTag's own frame (x right, y down, z into the tag), and the half turn about x in that of OpenCV (y up, z out of it).
# Seen: OpenCV diag(1, -1, -1), as expected; AprilTag diag(-1, -1, 1). A dock or a landing pad that was printed with the one and is read with the other sends a robot to the wrong side, and number and
# distance are right. Drawn upside down (turned by 180 deg) AprilTag has the identity. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check opencv-python-headless==5.0.0.93 pupil-apriltags==1.0.4.post11 numpy==2.4.6
"$folder/env/bin/python" - <<'CODE'
import sys

import cv2
import numpy as np
from pupil_apriltags import Detector

FOCAL, CENTRE, SIDE = 600.0, (320.0, 240.0), 0.1
family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
detector = Detector(families="tag36h11")


def poses(turned):
    """Rotation of tag 7, straight ahead, by AprilTag and by OpenCV, and the first corner of each, from the tag's centre (right, down)."""
    tag = np.rot90(cv2.aruco.generateImageMarker(family, 7, 160), 2 if turned else 0)
    image = np.full((480, 640), 255, np.uint8)
    image[160:320, 240:400] = tag
    (april,) = detector.detect(image, estimate_tag_pose=True, camera_params=(FOCAL, FOCAL, *CENTRE), tag_size=SIDE)
    corners, numbers, _ = cv2.aruco.ArucoDetector(family).detectMarkers(image)
    half = SIDE / 2
    model = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])  # OpenCV's order: clockwise from the upper left
    camera = np.array([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1]])
    _, vector, _ = cv2.solvePnP(model, corners[0][0].astype(float), camera, None)
    first = [tuple(np.sign(corner - [320, 240]).astype(int).tolist()) for corner in (april.corners[0], corners[0][0][0])]
    assert april.tag_id == numbers.ravel()[0] == 7
    return np.round(april.pose_R) + 0.0, np.round(cv2.Rodrigues(vector)[0]) + 0.0, *first


upright, upside_down = poses(turned=False), poses(turned=True)
for name, (april, opencv, corner_april, corner_opencv) in {"upright": upright, "upside down": upside_down}.items():
    print(f"OpenCV's tag, {name}: AprilTag diag{np.diag(april).tolist()}, first corner {corner_april}; OpenCV diag{np.diag(opencv).tolist()}, first corner {corner_opencv}")
right = np.array_equal(upright[0], np.diag([-1.0, -1.0, 1.0])) and np.array_equal(upright[1], np.diag([1.0, -1.0, -1.0]))
right &= np.array_equal(upside_down[0], np.eye(3)) and np.array_equal(upside_down[1], np.diag([-1.0, 1.0, -1.0]))
sys.exit(0 if right else 1)
CODE
