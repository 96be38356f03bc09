"""The pages of docs/reference, made of the types and tables that they tell of."""
