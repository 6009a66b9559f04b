"""The sheet as a 3-D solid: finite elements whose states are the ground truth of the evaluation.

A press of a ball, 5 mm deep in two steps, and the displacements of the dots::

    rubber = NeoHooke(young_MPa=3.1, poisson=0.45)
    model = SheetModel(size_mm=(120.0, 80.0), thickness_mm=3.0, material=rubber)
    path_mm = np.array([[10.0, 5.0, 2.5], [10.0, 5.0, 5.0]])  # x, y, depth of its lowest point per step
    touch = press(Sphere(radius_mm=6.0), thickness_mm=3.0, path_mm=path_mm)
    for state in StateCache(folder=folder).states(model, Loading(touches=(touch,))):
        displacement_mm, deformation_gradient = state.camera_side(dots_mm)
        print(state.status, state.contacts[0].force_N, state.contacts[0].centre_mm)

Inside are elements, contact, the solver, the cache of solved states and their read-out; formulae are in
docs/derivations/fem.md. Images and scenes are not: see `render` and `scene`.
"""
