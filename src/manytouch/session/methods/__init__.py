"""The methods: which stages each one has, and their parameters by name.

The stages themselves are in `detection`, `tracking`, `estimation` and `paper`.
"""

from manytouch.session.methods.parameter_info import parameter_info
from manytouch.session.methods.parameters import (
    ParameterValue,
    choices_of,
    parameters_of,
    value_text,
    with_parameter,
    with_parameters,
)
from manytouch.session.methods.pipelines import (
    DEFAULT,
    METHODS,
    default_method,
    kernels,
    pipeline_for,
    require_method_for,
)

__all__ = [
    "DEFAULT",
    "METHODS",
    "ParameterValue",
    "choices_of",
    "default_method",
    "kernels",
    "parameter_info",
    "parameters_of",
    "pipeline_for",
    "require_method_for",
    "value_text",
    "with_parameter",
    "with_parameters",
]
