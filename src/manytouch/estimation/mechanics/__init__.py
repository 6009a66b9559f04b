"""The method `mechanics`: inversion of the sheet's mechanics, force clusters, and contacts with covariances.

It does not contain the model of the sheet (`manytouch.mechanics`) or the tracking of contacts over frames.
"""
