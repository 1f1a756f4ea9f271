from tests.support.exported import exported as exported
