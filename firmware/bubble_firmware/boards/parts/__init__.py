"""What several boards share, once: a board's file takes it over with `import *` and says what is different."""
