//! The Parquet format: one row a step.
