"""Parameter sheet, reports and the published worksheet: results as people hand them on."""
