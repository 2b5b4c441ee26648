//! Properties of the certificate as a whole.
