"""Position control: wanted thrust and attitude of each drone (paper section 2.3)."""
