"""A solid that deforms: how freely, and which deformations it shows."""
