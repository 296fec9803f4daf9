"""Coupling terms from corrected demonstrations, models that learn them, and the runtime controller (IV.6)."""
