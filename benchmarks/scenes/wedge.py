"""What two faces of a concave corner can do to a disc at once.

Each pushes where it touches the disc, within its friction cone. Of both together the record has the
resultant, and a place on its line of action. That line may pass beside the disc: normal forces of
two faces can nearly cancel while their friction turns the disc.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def excess_over_cones(
    force: Array, moment: float, radius: float, normal: Array, friction: Array
) -> float:
    """How far a force and a moment about the centre of a disc are beyond what two faces can do.

    Relative to the force: zero if there are forces of both faces within their cones that add up.

    Parameters
    ----------
    force : (2,) float
        Resultant (x, z) in N.
    moment : float
        Its moment about the centre, from x to z, in N m.
    radius : float
        That of the disc (m), positive.
    normal : (2, 2) float
        Normals of the faces, one a row.
    friction : (2,) float
        Coefficients of friction of the faces.
    """
    tangent = np.stack((normal[:, 1], -normal[:, 0]), axis=1)
    # Unknown are normal and tangential force of the first face, and of the second.
    matrix = np.zeros((3, 4))
    matrix[:2, 0::2], matrix[:2, 1::2] = normal.T, tangent.T
    matrix[2, 1::2] = 1.0
    given = np.array([*force, moment / radius])
    particular = np.linalg.lstsq(matrix, given, rcond=None)[0]
    free = np.linalg.svd(matrix)[2][3]
    # What is left to each edge of the cones is a line over the share of the free direction.
    edges = np.array([[friction[0], 1, 0, 0], [friction[0], -1, 0, 0]])
    edges = np.vstack((edges, [[0, 0, friction[1], 1], [0, 0, friction[1], -1]]))
    begin, slope = edges @ particular, edges @ free
    missed = float(np.linalg.norm(matrix @ particular - given))
    if np.all(slope > 0.0) or np.all(slope < 0.0):
        # The faces can squeeze the disc, within their cones, as hard as it takes.
        return missed / max(float(np.linalg.norm(force)), 1e-300)
    shares = [0.0]
    for i, j in combinations(range(4), 2):
        if slope[i] != slope[j]:
            shares.append((begin[j] - begin[i]) / (slope[i] - slope[j]))
    most = max(float(np.min(begin + share * slope)) for share in shares)
    return (max(-most, 0.0) + missed) / max(float(np.linalg.norm(force)), 1e-300)
