//! What users do: combinations of the methods.
