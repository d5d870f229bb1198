"""Growth of derivation, compilation, evaluation and memory with a puppet's size: docs/growth.md."""
