"""How derivation, compilation, evaluation and memory grow with a puppet: docs/growth.md."""
