class InputError(ValueError):
    """A configuration or an input that can't be used.

    str() is one line naming source, field, value and expectation; problem is set where the source has no fields.
    """

    def __init__(self, message: str, source: str = "", field: str = "", value: str = "", expectation: str = "",
                 problem: str = "") -> None:
        super().__init__(message, source, field, value, expectation, problem)
        self.source = source
        self.field = field
        self.value = value
        self.expectation = expectation
        self.problem = problem

    def __str__(self) -> str:
        return str(self.args[0])
