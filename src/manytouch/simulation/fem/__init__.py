"""The sheet as a 3-D solid: finite elements whose states are the truth that estimators are judged by.

A press of a ball, 5 mm deep in two steps, and where the dots are then::

    rubber = NeoHooke(young_MPa=3.1, poisson=0.45)
    model = SheetModel(size_mm=(120.0, 80.0), thickness_mm=3.0, material=rubber)
    path_mm = np.array([[10.0, 5.0, 2.5], [10.0, 5.0, 5.0]])  # x, y, depth of its lowest point per step
    touch = press(Sphere(radius_mm=6.0), thickness_mm=3.0, path_mm=path_mm)
    for state in StateCache(folder=folder).states(model, Loading(touches=(touch,))):
        displacement_mm, deformation_gradient = state.camera_side(dots_mm)
        print(state.status, state.contacts[0].force_N, state.contacts[0].centre_mm)

Modules: `mesh`, `material`, `assembly` (elements), `fronts` (linear solver), `distance` and `indenters`,
`loading` (what presses), `contact`, `balance`, `solve` (Newton along a way), `sheet` (the clamped sheet),
`state`, `readout`, `sampling`, `cache`. Formulae: docs/derivations/fem.md.
"""
