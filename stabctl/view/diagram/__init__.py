"""One-line diagrams: where buses, branches, machines and storage are drawn, and what they carry in the power flow."""

from .one_line import OneLine, one_line, storage

__all__ = ["OneLine", "one_line", "storage"]
