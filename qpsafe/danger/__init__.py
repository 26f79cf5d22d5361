"""The danger field, the evasive motion it causes and the activations it switches."""
