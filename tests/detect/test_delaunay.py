"""The triangulation and its Voronoi cells, against Qhull, against closed forms, and on degenerate points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay, Voronoi, cKDTree

from survey_mc.detect._vtp.circle_sweep import order_by_distance
from survey_mc.detect._vtp.delaunay import qhull_triangulation, swept_triangulation, triangulate
from survey_mc.detect._vtp.exact_predicates import circle_side, turn
from survey_mc.detect._vtp.voronoi_cells import far_points, voronoi_cells

BITS = 14
UNIT = 1 << BITS


def ordered(points):
    """x, y (whole numbers) in the order of the sweep, and its centre."""
    x, y = np.asarray(points, dtype=np.float64).T
    centre = (np.rint(x.mean()), np.rint(y.mean()))
    order = order_by_distance(x.copy(), y.copy(), *centre)
    return x[order], y[order], *centre


def triangle_set(triangles):
    return {tuple(sorted(t)) for t in np.asarray(triangles).reshape(-1, 3).tolist()}


def cells_of(points_pix, shape, observed=None):
    """Cells of points given in pixels, in the order of the sweep, and those points."""
    x, y, *centre = ordered(np.rint(np.asarray(points_pix) * UNIT))
    far_x, far_y = far_points(shape[1], shape[0])
    all_x, all_y = np.append(x, far_x * UNIT), np.append(y, far_y * UNIT)
    mesh = triangulate(all_x, all_y, *centre)
    observed = np.ones(shape, dtype=bool) if observed is None else observed
    return voronoi_cells(all_x, all_y, len(x), mesh, observed, BITS), np.stack([x, y], axis=1) / UNIT


@pytest.mark.parametrize("n", [4, 7, 50, 3000])
def test_random_points_have_the_triangles_of_qhull(n):
    x, y, *centre = ordered(np.random.default_rng(n).integers(0, 2**23, (n, 2)))
    mesh = swept_triangulation(x, y, *centre)
    assert triangle_set(mesh.corner) == triangle_set(Delaunay(np.stack([x, y], axis=1)).simplices)
    assert triangle_set(qhull_triangulation(x, y).corner) == triangle_set(mesh.corner)


def test_clustered_points_have_the_triangles_of_qhull():
    rng = np.random.default_rng(5)
    points = np.concatenate([rng.integers(0, 2**23, (500, 2)), 2**22 + rng.integers(0, 2**16, (1500, 2))])
    x, y, *centre = ordered(np.unique(points, axis=0))
    mesh = swept_triangulation(x, y, *centre)
    assert triangle_set(mesh.corner) == triangle_set(Delaunay(np.stack([x, y], axis=1)).simplices)


@pytest.mark.parametrize("coordinates", [2, 5, 40, 2**25])
@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_any_distinct_points_are_triangulated_exactly(coordinates, data):
    place = st.tuples(st.integers(0, coordinates), st.integers(0, coordinates))
    points = data.draw(st.lists(place, min_size=3, max_size=40, unique=True))
    x, y, *centre = ordered(points)
    mesh = swept_triangulation(x, y, *centre)  # checked: every edge Delaunay, Euler's number of triangles
    on_a_line = np.linalg.matrix_rank((np.stack([x, y], axis=1) - [x[0], y[0]]).astype(float)) < 2
    assert (mesh is None) == on_a_line
    if mesh is not None:
        corner = mesh.corner.reshape(-1, 3)
        area = sum(turn(x, y, *t) for t in corner.tolist())
        assert set(corner.ravel().tolist()) == set(range(len(x)))
        hull = Delaunay(np.stack([x, y], axis=1)).convex_hull
        middle = [x.mean(), y.mean()]
        spokes = np.stack([x, y], axis=1)[hull] - middle
        assert area == pytest.approx(np.abs(np.linalg.det(spokes)).sum(), rel=1e-9)


def test_points_on_a_line_or_too_few_are_refused():
    line = np.arange(9.0)
    for x, y in ((line, line), (line[:2], line[:2] * 0.0)):
        with pytest.raises(ValueError, match="cannot triangulate"):
            triangulate(x, y, 0.0, 0.0)


def test_circle_test_is_exact_where_floating_point_is_not():
    big = float(2**25)
    x, y = np.array([big, 0.0, -big, 0.0, 0.0]), np.array([0.0, big, 0.0, -big, 1.0 - big])
    assert circle_side(x, y, 0, 1, 2, 3) == 0
    assert circle_side(x, y, 0, 1, 2, 4) == 1
    exact = np.random.default_rng(3).integers(-(2**24), 2**24, (2000, 4, 2))
    exact[:, 3] = exact[:, 0] + np.random.default_rng(4).integers(-1, 2, (2000, 2))  # hardly off a corner: cancellation
    for points in exact.tolist():
        a, b, c, p = points
        rows = [[q[0] - p[0], q[1] - p[1], (q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2] for q in (a, b, c)]
        (u, v, w) = rows
        determinant = (
            u[2] * (v[0] * w[1] - v[1] * w[0]) + v[2] * (w[0] * u[1] - w[1] * u[0]) + w[2] * (u[0] * v[1] - u[1] * v[0])
        )  # Python's integers have no limit
        xs, ys = np.array(points, dtype=np.float64).T.copy()
        assert circle_side(xs, ys, 0, 1, 2, 3) == (determinant > 0) - (determinant < 0)


def test_order_by_distance_sorts_and_keeps_the_order_of_equals():
    rng = np.random.default_rng(6)
    x, y = rng.integers(0, 60, 4000).astype(float), rng.integers(0, 60, 4000).astype(float)
    order = order_by_distance(x, y, 30.0, 31.0)
    np.testing.assert_array_equal(order, np.argsort((x - 30.0) ** 2 + (y - 31.0) ** 2, kind="stable"))


def test_areas_are_those_of_voronoi_with_mirrored_points():
    rng = np.random.default_rng(7)
    height, width = 30, 50
    cells, points = cells_of(rng.uniform(-0.5, [width - 0.5, height - 0.5], (300, 2)), (height, width))
    copies = [points]
    for axis, size in ((0, width), (1, height)):
        for edge in (-0.5, size - 0.5):
            mirrored = points.copy()
            mirrored[:, axis] = 2.0 * edge - mirrored[:, axis]
            copies.append(mirrored)
    diagram = Voronoi(np.concatenate(copies))
    for i in range(len(points)):
        x, y = diagram.vertices[diagram.regions[diagram.point_region[i]]].T
        area = 0.5 * abs(x @ np.roll(y, 1) - y @ np.roll(x, 1))
        assert cells.area_pix[i] == pytest.approx(area, rel=1e-6)
    assert cells.area_pix.sum() == pytest.approx(height * width, rel=1e-10)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(st.integers(0, 11), st.integers(0, 7)), min_size=1, max_size=96, unique=True))
def test_cells_of_any_pixels_fill_the_image(pixels):
    cells, points = cells_of(pixels, (8, 12))
    assert cells.area_pix.sum() == pytest.approx(96.0, rel=1e-9)
    fine = (np.stack(np.meshgrid(np.arange(240), np.arange(160)), axis=-1).reshape(-1, 2) + 0.5) / 20.0 - 0.5
    share = np.bincount(cKDTree(points).query(fine)[1], minlength=len(points)) / 400.0
    assert np.abs(cells.area_pix - share).max() < 4.0  # ties of the sampled points go to one side


def test_full_lattice_has_unit_cells_with_four_neighbours():
    row, column = np.mgrid[:20, :30]
    cells, _ = cells_of(np.stack([column.ravel(), row.ravel()], axis=1), (20, 30))
    np.testing.assert_array_equal(cells.area_pix, 1.0)
    assert len(cells.neighbours) == 19 * 30 + 20 * 29


def test_cells_that_meet_only_beyond_the_image_or_in_the_mask_are_no_neighbours():
    inner = [(x, y) for x in range(2, 58, 2) for y in range(4, 38, 2)]
    observed = np.ones((40, 60), dtype=bool)
    cells, points = cells_of([*inner, (5, 0), (55, 0)], observed.shape)
    assert {(5.0, 0.0), (55.0, 0.0)} not in [set(map(tuple, points[pair])) for pair in cells.neighbours]
    observed[:3] = False
    masked, _ = cells_of(inner, observed.shape, observed)
    whole, _ = cells_of(inner, observed.shape)
    assert len(masked.neighbours) <= len(whole.neighbours)
    assert not masked.whole.all()
    assert whole.whole.all()
