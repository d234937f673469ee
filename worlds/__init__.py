"""Floor plans: model, JSON, importers, generator, extrusion and rasterised ground truth."""
