"""From nodal forces to clusters: their number, the patches of pressure that explain them, and rigid faces.

Contacts with identities and deviations are made in `contacts` and `estimator`; regions are in `regions`.
"""
