"""The interactive page `stabctl live`: a server for this machine only, and a page that simulates as sliders move."""
