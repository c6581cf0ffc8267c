"""Every rig against every published number."""

from rigs.validation.validate import Validation, validate

__all__ = ["Validation", "validate"]
