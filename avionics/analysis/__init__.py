"""After the flight: data sets in, figures, tables and reports out."""
