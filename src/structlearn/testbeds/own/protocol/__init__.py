"""What is run and scored on recordings of your own."""
