"""What a diagnosis writes: verdict.json, the extended model, report.html."""
