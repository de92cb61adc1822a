"""Pictures and pages of recordings and studies."""
