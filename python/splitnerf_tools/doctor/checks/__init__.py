"""The checks, one module a family of operators and one for all backward passes; importing them fills the table."""

from splitnerf_tools.doctor.checks import fields, gradients, light, losses, rays, shading, tracing

__all__ = ["fields", "gradients", "light", "losses", "rays", "shading", "tracing"]
