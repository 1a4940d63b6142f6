"""Messages of the CCSDS, in which flight dynamics exchanges orbits (OEM) and attitudes (AEM)."""
