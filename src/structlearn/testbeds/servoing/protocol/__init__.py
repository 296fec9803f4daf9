"""Which controllers servo from where to where, and how well."""
